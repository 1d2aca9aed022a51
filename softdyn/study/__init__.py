"""What is found of a law, told and shown: tables, figures, a report, measured exponents, another law to compare with.

It may derive, and it may draw; nothing that runs a scene imports it.
"""
