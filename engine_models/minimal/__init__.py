"""The independent solver in minimal coordinates; read ``equations``, then ``model``, then ``run``."""
