// SPDX-License-Identifier: BSD-3-Clause
// Planted faults for package.config_fields_finds_faults.
void list(FieldList& f, Inner<float>& o) {
  f("kept", o.kept, "m", "meaning");
  f("pair", std::span<double>(o.pair), "", "meaning");
}

void list(FieldList& f, Base& o) {
  f("bits", o.bits, "", "meaning");
}

void list(FieldList& f, Outer& o) {
  // left out: derived: from the others
  // left out: gone: no such field
  f.table("inner", o.inner);
  f("near", o.near, "m", "meaning");
  f("distance", o.far, "m", "meaning");
}

void list(FieldList& f, Unknown& o) {
  f("value", o.value, "", "meaning");
}
