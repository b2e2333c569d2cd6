"""The catalogue of effects and the forms in which a search puts them into a model."""
