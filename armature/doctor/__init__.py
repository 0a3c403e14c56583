"""What `armature doctor` looks at."""
