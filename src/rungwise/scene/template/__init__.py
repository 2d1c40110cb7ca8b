"""Scenes as templates: records with literal numbers, and programs for the others."""
