"""Scenes with known cameras, their ground truth, and what an estimate is measured against it."""
