"""`python -P -m hub.command_line`: the same as `trocar`, for processes that are started with a given
interpreter.
"""

from hub.command_line import main

main()
