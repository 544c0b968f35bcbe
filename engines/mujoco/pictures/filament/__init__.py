"""Pictures by MuJoCo's physically based renderer, Filament."""
