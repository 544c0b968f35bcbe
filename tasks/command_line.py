"""`trocar score`."""

import typer

app = typer.Typer()


@app.command()
def score() -> None:
    """Score a recording."""
