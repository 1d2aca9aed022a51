"""Okabe & Ito's colours, told apart by all."""

SKY, AMBER = "#56B4E9", "#E69F00"
BLUE, ORANGE, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
