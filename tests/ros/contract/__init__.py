"""One suite over the port (`rise_adapters.ros2.transport.port`), on the real wire, for each pair of transports.

Two processes (`peer`) hold a transport each and do what a test says (`peers`); the process of pytest itself opens none.
"""
