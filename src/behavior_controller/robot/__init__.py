"""What a robot offers and how it is asked; the seam between leaves and ROS."""
