"""Recorders behind `rise_engine.ports.recorder`: OBS, ffmpeg, the bags of ROS 2, LabRecorder
(docs/how-to/record-a-session.md)."""
