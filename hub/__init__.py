"""The hub: sessions, hosts, transport, recording and command line, and the interface of participants."""
