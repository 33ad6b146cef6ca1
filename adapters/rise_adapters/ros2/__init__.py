"""RISE on ROS 2. From the wire upwards:

    transport/      messages on topics and services: the port, and two ways to speak ROS 2 behind it
    actions/        ROS 2 actions on top of that, both sides: one server, one client, written once for both ways
    mapping/        what a robot's profile says about ROS: which action or topic carries what, and what fills its fields
    compatibility   whether what a robot has on ROS fits its mapping; graph_checks: the same for everybody's topics
    robot/          a robot behind the engine's port: goals, their deadlines and endings, stop-all, how it stands
    record_messages records as messages, for the next two
    session_node/   the session as other nodes see it: tasks, memory, records, diagnostics, other sessions
    bag/            a recorded session as a bag
    bridge          a session's one connection, which both of these share
    doctor/         what `rise-engine doctor` finds on this machine and on the network
    examples/       nodes to copy, and a robot that is not there

Imports point upwards in this list, never down.
"""
