"""Pictures of an endoscope on the sockets that the dVRK's console and recorder read (kind `dvrk-video`)."""
