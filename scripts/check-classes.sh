#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Says which classes of runtime/ have more than 15 private methods or more than 20 data members; exits with 1 where
# there are any. Static members are not counted, nor is a struct without a constructor or a private part: options and
# results may have as many fields as they need. A class that has to be larger is named in `exceptions` below.
#
#   scripts/check-classes.sh [FOLDER...]
#
# Environment: MAX_PRIVATE, MAX_DATA other limits; LIST=1 says how large every class is, largest first;
# EXPECT_FAULTS so many faults are a success (for its own test).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[ $# -gt 0 ] || set -- runtime

# CLASS PRIVATE_METHODS DATA_MEMBERS, as they are allowed instead
exceptions=""

counts=$(find "$@" -name '*.hpp' -o -name '*.cpp' | LC_ALL=C sort | xargs awk '
  function trim(text) { gsub(/^[ \t]+|[ \t]+$/, "", text); return text }
  # Without template arguments and attributes.
  function bare(text) {
    gsub(/\[\[[a-z]+\]\]/, "", text)
    gsub(/operator *(<=>|<<|>>|<=|>=|<|>|\(\))/, "operator", text)
    while (gsub(/<[^<>]*>/, "", text)) {}
    return trim(text)
  }
  function is_type(text) { return text !~ /(^| )enum / && text ~ /(^|[ >])(class|struct|union) +[A-Za-z_0-9:]+( final)?( : .*)?$/ }
  function type_name(text) {
    sub(/^.*(class|struct|union) +/, "", text)
    sub(/( final)?( : .*)?$/, "", text)
    return text
  }
  function method(    name) {
    if (access[depth] != "public") ++methods[depth]
    name = names[depth]; sub(/^.*::/, "", name)
    if (statement ~ ("(^|explicit |constexpr )" name " *\\(")) is_class[depth] = 1
  }
  # Of the class at `depth`, at the end of a member.
  function member(    text, parts) {
    text = bare(statement)
    if (text == "" || text ~ /^(using|typedef|friend|static_assert|enum)($| )/) return
    if (text ~ /^(class|struct|union) [A-Za-z_0-9:]+$/ || text ~ /= *(default|delete)$/) return
    statement = text
    sub(/=.*$/, "", text)
    if (text ~ /\(/) { method(); return }
    if (statement ~ /^((inline|constexpr) )*static /) return
    text = statement
    while (gsub(/\([^()]*\)/, "", text)) {}
    gsub(/=[^,]*/, "", text)
    members[depth] += split(text, parts, ",")
  }
  function end_class() {
    if (is_class[depth]) print names[depth], methods[depth] + 0, members[depth] + 0, file
  }
  function read_file(text,    i, c, n) {
    depth = 0; statement = ""; kind[0] = "namespace"; parens = 0
    n = length(text)
    for (i = 1; i <= n; ++i) {
      c = substr(text, i, 1)
      if (kind[depth] == "body") {  # of a function or an initialiser
        if (c == "{") ++braces; else if (c == "}" && --braces == 0) { --depth; if (ends_member) statement = "" }
        continue
      }
      if (c == "(") ++parens; else if (c == ")") --parens
      if (parens > 0 && c == "{") { skip = 1; while (skip > 0) { c = substr(text, ++i, 1); skip += (c == "{") - (c == "}") } continue }
      if (parens > 0) { statement = statement c; continue }
      if (c == "{") {
        head = bare(statement)
        if (is_type(head)) {
          name = type_name(head)
          ++depth; kind[depth] = "type"; names[depth] = name; methods[depth] = members[depth] = 0
          is_class[depth] = head ~ /(^| )class / ? 1 : 0
          access[depth] = is_class[depth] ? "private" : "public"
          statement = ""
        } else if (head ~ /^(inline )?namespace|^extern/ || (head == "" && kind[depth] == "namespace")) {
          ++depth; kind[depth] = "namespace"; statement = ""
        } else {
          ends_member = 0
          if (kind[depth] == "type" && head ~ /\(/ && head !~ /=[^=]*$/) { statement = head; method_of_body(); ends_member = 1 }
          if (kind[depth] == "namespace" && head ~ /\(/) ends_member = 1
          ++depth; kind[depth] = "body"; braces = 1
        }
      } else if (c == "}") {
        if (kind[depth] == "type") end_class()
        if (depth > 0) --depth
        statement = ""
      } else if (c == ";") {
        if (kind[depth] == "type") member()
        statement = ""
      } else {
        statement = statement c
        if (c == ":" && kind[depth] == "type" && trim(statement) ~ /^(public|private|protected):$/) {
          access[depth] = trim(statement); sub(/:$/, "", access[depth])
          if (access[depth] != "public") is_class[depth] = 1
          statement = ""
        }
      }
    }
  }
  function method_of_body() { if (statement !~ /^(friend|static_assert)/) method() }
  FNR == 1 { if (file != "") read_file(whole); file = FILENAME; whole = "" }
  /^[ ]*#/ { next }
  {
    gsub(/\\"/, ""); gsub(/"[^"]*"/, "0"); gsub(/\047[^\047]*\047/, "0"); sub(/\/\/.*$/, "")
    whole = whole " " $0
  }
  END { read_file(whole) }')

if [ "${LIST:-0}" = 1 ]; then sort -k2,2nr -k3,3nr <<< "$counts"; fi
faults=$(awk -v max_private="${MAX_PRIVATE:-15}" -v max_data="${MAX_DATA:-20}" -v exceptions="$exceptions" '
  BEGIN {
    n = split(exceptions, line, "\n")
    for (i = 1; i <= n; ++i) if (split(line[i], field, " ") == 3) { most[field[1]] = field[2]; data[field[1]] = field[3] }
  }
  {
    private = $1 in most ? most[$1] : max_private
    members = $1 in data ? data[$1] : max_data
    if ($2 > private) print $4 ": " $1 " has " $2 " private methods, at most " private
    if ($3 > members) print $4 ": " $1 " has " $3 " data members, at most " members
  }' <<< "$counts")
[ -z "$faults" ] || echo "$faults"
[ "$(grep -c . <<< "$faults")" -eq "${EXPECT_FAULTS:-0}" ]
