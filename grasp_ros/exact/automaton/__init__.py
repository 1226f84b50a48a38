"""The modes of pairs and object, and every transition between them."""
