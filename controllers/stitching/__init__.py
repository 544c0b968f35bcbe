"""A scripted surgeon that makes stitches from measured poses, with two needle drivers."""
