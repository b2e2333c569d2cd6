"""A first linear model from records alone: a gain with a delay, lags or modes, its order chosen by evidence.

structures      what a first model may consist of, and the plant that it makes
start_values    where the fits of a structure begin
fit             one structure by the error of the simulated readings, gain and offsets solved for inside
choice          which structure the records support
"""
