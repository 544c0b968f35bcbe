"""The material of tissue from measured depths and forces of an indenter."""
