"""The collocation problems as a user of each library writes them, and a worker that runs them."""
