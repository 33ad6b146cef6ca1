"""Recorders: OBS, ffmpeg, the bags of ROS 2, LabRecorder (docs/how-to/record-a-session.md)."""
