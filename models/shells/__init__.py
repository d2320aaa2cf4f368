"""Explicit thin shells: elements, material, contact and the car front made of them."""
