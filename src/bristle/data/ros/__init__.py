"""Columns of ROS bags: files, storage formats, message definitions, messages decoded over arrays."""
