#!/bin/sh
# Installs the browser in which the tests open the HTML report: Debian's or Ubuntu's chromium.
# Does nothing where one is found.
exec "$(dirname "$0")/install_tool.sh" chromium \
    chromium chromium-browser google-chrome google-chrome-stable
