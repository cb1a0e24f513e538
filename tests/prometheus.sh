#!/bin/sh
# The alerts that are shipped, by the distribution's promtool: they are rules, and fire for what they are for.
set -eu
cd "$(dirname "$0")/.."

tests/install_tool.sh prometheus promtool
promtool check rules config/live/prometheus_alerts.yml
promtool test rules tests/prometheus_alerts_test.yml
