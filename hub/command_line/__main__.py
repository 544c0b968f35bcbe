"""`python -P -m hub.command_line`: `trocar` with a given Python interpreter."""

from hub.command_line import main

main()
