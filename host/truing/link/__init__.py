"""The framed link to a board: frames, byte streams, and requests with retry.

`framing` knows bytes only, a `Stream` moves them (serial port, TCP, virtual board), `Client` pairs
replies with requests, and `connect` turns the user's `--port` into a `Client`.
"""
