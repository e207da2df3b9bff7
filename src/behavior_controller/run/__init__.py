"""What happens while a mission runs: typed events, the model that is folded from them, its
sentences, and its record"""
