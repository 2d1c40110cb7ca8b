"""Pictures of runs in space: pages that play without a network, and live views."""
