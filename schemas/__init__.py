"""Messages, ports, scenario, codecs and keys: what all parts of Trocar agree on. Imports none of them."""
