#!/bin/sh
# --known
