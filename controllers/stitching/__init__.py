"""A scripted surgeon that makes stitches from the poses it is given, with two needle drivers."""
