"""What a responder imports in the place of the notebook's simulator widget."""
