"""The scene: the physics of a mechanism as data, the library's scenes, and files of users."""
