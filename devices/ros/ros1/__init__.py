"""ROS 1: a node in pure Python (XML-RPC and TCPROS)."""
