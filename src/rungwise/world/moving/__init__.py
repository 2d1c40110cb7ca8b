"""What every world has whose bodies are a system that the core takes steps of, without knowing more of it."""
