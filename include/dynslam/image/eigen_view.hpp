// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <concepts>
#include <type_traits>

#include "dynslam/image/image_view.hpp"
#include "dynslam/image/strided_view.hpp"

namespace dynslam {

namespace detail {
template <class D>
void as_dense_base(const Eigen::DenseBase<D>&);

/// An Eigen matrix or array, map, reference or block whose elements lie in memory.
template <class D>
concept EigenInMemory = requires(const D& d) {
  as_dense_base(d);
  { d.derived().data() } -> std::convertible_to<const typename D::Scalar*>;
  d.derived().innerStride();
  d.derived().outerStride();
};

/// Owns its elements: a view of a temporary one would outlive it.
template <class D>
concept EigenOwner = std::derived_from<D, Eigen::PlainObjectBase<D>>;

/// Whether each row is contiguous whatever the sizes.
template <class D>
inline constexpr bool kEigenRowsContiguous = bool(D::IsRowMajor) && int(D::InnerStrideAtCompileTime) == 1;

template <class T, class D>
[[nodiscard]] auto eigen_view(T* data, const D& m) {
  const auto width = static_cast<int>(m.cols()), height = static_cast<int>(m.rows());
  if constexpr (kEigenRowsContiguous<D>) {
    return ImageView<T>(data, width, height, static_cast<std::ptrdiff_t>(m.outerStride()));
  } else {
    const auto inner = static_cast<std::ptrdiff_t>(m.innerStride()),
               outer = static_cast<std::ptrdiff_t>(m.outerStride());
    return D::IsRowMajor ? StridedView<T>(data, width, height, inner, outer)
                         : StridedView<T>(data, width, height, outer, inner);
  }
}
}  // namespace detail

/// View of an Eigen matrix or array, of a map, reference or block of one, indexed (u, v) = (column, row)
/// without a copy, whatever the storage order: an ImageView where rows are contiguous (row-major), a
/// StridedView otherwise. Changes through the view change the matrix; of a constant matrix it is a view of
/// constants. The view is valid as long as the matrix has its memory; a temporary that owns its memory gives
/// none.
template <class M>
  requires(detail::EigenInMemory<std::remove_cvref_t<M>> &&
           (std::is_lvalue_reference_v<M> || !detail::EigenOwner<std::remove_cvref_t<M>>))
[[nodiscard]] auto view(M&& m) {
  return detail::eigen_view(m.data(), m);
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
