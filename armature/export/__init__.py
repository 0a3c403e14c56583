"""Results as files that other programs read: tables, arrays, and motions in ROS's form."""
