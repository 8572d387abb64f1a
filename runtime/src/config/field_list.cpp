// SPDX-License-Identifier: BSD-3-Clause
#include "config/field_list.hpp"

#include <algorithm>

namespace dynslam::runtime::config {

template <class T>
void FieldList::operator()(std::string_view key, T& value, std::string_view unit, std::string_view meaning,
                           const ConfigRange& range) {
  add(key, &value, unit, meaning, range);
}

void FieldList::operator()(std::string_view key, std::span<double> values, std::string_view unit,
                           std::string_view meaning, const ConfigRange& range) {
  add(key, values, unit, meaning, range);
}

void FieldList::operator()(std::string_view key, const ConfigChoice& choice, std::string_view meaning) {
  add(key, choice, "", meaning, kAny);
}

std::size_t FieldList::enter(std::string_view key) {
  const std::size_t outer = table_.size();
  if (outer > 0) table_ += '.';
  table_ += key;
  return outer;
}

void FieldList::add(std::string_view key, ConfigValue value, std::string_view unit, std::string_view meaning,
                    const ConfigRange& range) {
  ConfigField field{table_, std::string(key), std::string(unit), std::string(meaning),
                    range,  std::move(value)};
  field.tuning = std::ranges::find(user_field_names(), field.name()) == user_field_names().end();
  fields_.push_back(std::move(field));
}

#define DYNSLAM_FIELD_TYPE(T)                                                                      \
  template void FieldList::operator()<T>(std::string_view, T&, std::string_view, std::string_view, \
                                         const ConfigRange&);
DYNSLAM_FIELD_TYPE(bool)
DYNSLAM_FIELD_TYPE(int)
DYNSLAM_FIELD_TYPE(std::uint64_t)
DYNSLAM_FIELD_TYPE(float)
DYNSLAM_FIELD_TYPE(double)
DYNSLAM_FIELD_TYPE(std::string)
DYNSLAM_FIELD_TYPE(std::filesystem::path)
DYNSLAM_FIELD_TYPE(std::vector<std::string>)
DYNSLAM_FIELD_TYPE(cv::Size)
DYNSLAM_FIELD_TYPE(std::optional<double>)
#undef DYNSLAM_FIELD_TYPE

}  // namespace dynslam::runtime::config
