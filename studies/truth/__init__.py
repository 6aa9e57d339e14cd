"""The independent truth of any planar mechanism; read ``tree``, then ``equations``, then ``motion``."""
