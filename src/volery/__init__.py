"""volery: an asynchronous networked agent emulator over Eclipse Zenoh."""
