# What Doxygen reads of a header, instead of the header; line numbers stay.
# Every header has a page of its own.
1s|^// SPDX-License-Identifier:.*|/// \\file|
# In comments "Eq (7)", "Eq 7" and the "Eqs" before a list become links to docs/api/equations.md.
/\/\// {
  s/\bEq \(?(1[0-3]|[1-9])\b\)?/\\ref eq_\1 "&"/g
  s/\bEqs\b/\\ref equations "Eqs"/g
}
# Attributes of compilers are no part of a signature.
s/\bDYNSLAM_NO_DANGLING //
