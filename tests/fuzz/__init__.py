"""Scenarios with mistakes nobody thought of: the shipped ones, mutated, read and checked."""
