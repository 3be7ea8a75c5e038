"""The screen: what each effect could explain, from one linearisation."""
