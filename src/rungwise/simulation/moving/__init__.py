"""Runs of whatever scene has bodies that are a system the core takes steps of (see `system.moving`)."""
