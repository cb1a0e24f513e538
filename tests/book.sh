#!/usr/bin/env bash
# Builds the documentation as a book, target/book/index.html, with MkDocs from PyPI. A link that leads
# nowhere fails it, and so does a page that no chapter of .mkdocs.yml names.
set -euo pipefail
cd "$(dirname "$0")/.."

place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
if ! python3 -c 'import ensurepip, venv' 2>/dev/null; then
  # No program is called so: the package is installed.
  tests/install_tool.sh python3-venv python3-venv
fi
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet --disable-pip-version-check mkdocs==1.6.1 markdown==3.11.3

python3 tests/book_pages.py target/book_pages
# Not --quiet: with it, MkDocs counts no warnings.
"$place/venv/bin/mkdocs" build --strict --config-file .mkdocs.yml
echo "the book: target/book/index.html"
