"""`python -P -m trocar`: the same as the command `trocar`, with a given interpreter."""

from hub.command_line import main

main()
