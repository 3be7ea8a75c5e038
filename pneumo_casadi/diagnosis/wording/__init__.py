"""Sentences of a diagnosis, made from its figures: results, JSON and reports quote them."""
