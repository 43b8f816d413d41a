"""Recordings of many robots over years: diagnosed on a cluster, compared, followed in time."""
