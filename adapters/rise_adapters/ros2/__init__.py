"""RISE on ROS 2. From the wire upwards:

  transport/      messages on topics and services: the port, and two implementations of it
  actions/        ROS 2 actions on top of that: one server and one client, written once for both transports
  mapping/        a profile's tables about ROS: which action or topic carries what, and what fills its fields
  compatibility   whether a robot on ROS fits its mapping; graph_checks: the same for the topics of other nodes
  robot/          a robot behind the engine's port: goals, their deadlines and endings, stop-all, health
  record_messages records as messages, for the next two
  session_node/   the session for other nodes: tasks, memory, records, diagnostics, other sessions
  bag             a recorded session as a bag
  bridge          a session's one connection, shared by its robot and its node
  doctor/         the examination of this machine and the network by `rise-engine doctor`

Modules import from those above them in this list, never from those below.
"""
