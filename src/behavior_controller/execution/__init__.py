"""What happens while a mission runs, as typed events, and the model of the run that is folded from
them."""
