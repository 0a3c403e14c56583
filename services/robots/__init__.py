"""Arms that people bring: from a URDF and a few settings to the robot format, and what looks wrong in one."""
