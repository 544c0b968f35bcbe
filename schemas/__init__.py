"""Messages, ports, scenario, codecs and keys: what every part of Trocar agrees on. Imports nothing of ours."""
