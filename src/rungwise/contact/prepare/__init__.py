"""What a problem becomes before it is solved: eliminated, scaled, ranked, taken apart into islands."""
