#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Says which fields of the options' structs are missing in the table of a configuration file's fields
# (runtime/src/config/); exits with 1 where there are any. A field is listed under its own name by the struct's
# list(), or named there in a comment "// left out: NAME: reason".
#
#   scripts/check-config-fields.sh [FOLDER]     with runtime/src/config/, include/ and, if any, runtime/include/
#
# Environment: EXPECT_FAULTS so many faults are a success (for its own test).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
cd "${1:-.}"

folders=(runtime/src/config include)
[ ! -d runtime/include ] || folders+=(runtime/include)
faults=$(find "${folders[@]}" -name '*.hpp' -o -name '*.cpp' |
  LC_ALL=C sort -r | xargs awk '
  function report(text) { print text }
  function trim(text) { gsub(/^[ \t]+|[ \t]+$/, "", text); return text }

  # The calls of a list(): f("NAME", o.NAME, ...) and f.table("NAME", o.NAME).
  function read_table(type, body,    found, key, member) {
    while (match(body, /f(\.table)?\("[A-Za-z_0-9]+", *(choice\(|std::span<double>\()?o\.[A-Za-z_0-9]+/)) {
      found = substr(body, RSTART, RLENGTH)
      body = substr(body, RSTART + RLENGTH)
      member = found; sub(/^.*o\./, "", member)
      key = found; sub(/^[^"]*"/, "", key); sub(/".*$/, "", key)
      if (key != member) report(type ": \"" key "\" names the field " member)
      listed[type, member] = 1
    }
  }

  # A statement of a struct: the names of the fields that it declares.
  function read_statement(type, text,    parts, n, i, name) {
    text = trim(text)
    if (text == "" || text ~ /^(using|static|enum|friend|typedef|struct|template)[ <]/) return
    if (text ~ /(^| )operator[^A-Za-z_0-9]/) return
    gsub(/<</, "", text)
    while (gsub(/<[^<>]*>/, "", text)) {}
    n = split(text, parts, ",")
    for (i = 1; i <= n; ++i) {
      name = parts[i]
      sub(/[={].*$/, "", name)
      if (name ~ /\(/) return  # a function
      name = trim(name)
      if (!match(name, /[A-Za-z_][A-Za-z_0-9]*$/)) continue
      name = substr(name, RSTART)
      member_of[type, name] = 1
      if (!((type, name) in listed) && !((type, name) in left_out))
        report(type ": the field " name " is in no table of runtime/src/config/")
    }
  }

  function read_struct(type, text,    i, c, depth, paren, statement) {
    for (i = 1; i <= length(text); ++i) {
      c = substr(text, i, 1)
      if (depth > 0) {
        depth += (c == "{") - (c == "}")
      } else if (paren > 0) {
        paren += (c == "(") - (c == ")")
      } else if (c == "(") {
        paren = 1
        statement = statement "()"
      } else if (c == "{") {
        depth = 1
        if (statement ~ /\(/ && statement !~ /=/) statement = ""  # the body of a function
      } else if (c == "}") {
        return
      } else if (c == ";") {
        read_statement(type, statement)
        statement = ""
      } else {
        statement = statement c
      }
    }
  }

  function read_header(text,    name, base) {
    while (match(text, /struct [A-Za-z_0-9]+( : [A-Za-z_0-9]+(<[a-z]+>)?)? \{/)) {
      name = substr(text, RSTART + 7, RLENGTH - 9)
      text = substr(text, RSTART + RLENGTH)
      base = name
      if (sub(/^.* : /, "", base)) sub(/ : .*$/, "", name); else base = ""
      sub(/<.*$/, "", base)
      if (!(name in tables)) continue
      defined[name] = 1
      if (base != "" && !((name, base) in bases)) report(name ": the fields of " base " are in no table")
      read_struct(name, text)
    }
  }

  # Tables come first: by their path, in reversed order.
  FNR == 1 { if (header != "") read_header(header); header = ""; in_table = FILENAME ~ /^runtime\/src\/config\// }
  in_table {
    if (match($0, /^void list\(FieldList& f, [A-Za-z_0-9]+(<[A-Za-z]+>)?& o\) \{/)) {
      type = substr($0, RSTART, RLENGTH)
      sub(/^.*f, /, "", type); sub(/[<&].*$/, "", type)
      tables[type] = 1
      body = ""
    } else if (type != "" && /^\}/) {
      read_table(type, body)
      type = ""
    } else if (type != "" && match($0, /\/\/ left out: [A-Za-z_0-9]+: ./)) {
      name = substr($0, RSTART + 13, RLENGTH - 16)
      left_out[type, name] = 1
    } else if (type != "" && match($0, /static_cast<[A-Za-z_0-9]+/)) {
      bases[type, substr($0, RSTART + 12, RLENGTH - 12)] = 1
    }
    body = body " " trim($0)
    next
  }
  { sub(/[ ]*\/\/.*$/, ""); header = header " " $0 }
  END {
    read_header(header)
    for (type in tables) if (!(type in defined)) report(type ": no header defines it")
    for (both in left_out) {
      split(both, pair, SUBSEP)
      if (!(both in member_of)) report(pair[1] ": " pair[2] " is left out, but it has no such field")
    }
  }')
[ -z "$faults" ] || echo "$faults"
[ "$(grep -c . <<< "$faults")" -eq "${EXPECT_FAULTS:-0}" ]
