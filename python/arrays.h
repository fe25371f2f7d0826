// python/arrays.h: what the module hands to Python: errors as exceptions, arrays that lie in what their object owns.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <string>
#include <utility>
#include <vector>

#include "pipeline/lamina.h"

namespace lamina::python {

namespace py = pybind11;

/// Adds Error and its kinds to the module.
void define_errors(py::module_& module);

/// Throws the Python exception of an error: the one line, and its exit code as `code`. Holds the lock of the interpreter.
[[noreturn]] void raise(const Error& error);

/// What `work` gives, made without the lock of the interpreter, or its exception.
template <class Work>
auto without_lock(Work work) {
  auto result = [&] {
    const py::gil_scoped_release release;
    return work();
  }();
  if (!result) raise(result.error());
  if constexpr (!std::is_same_v<decltype(result), Status>) return std::move(*result);
}

/// An array over memory that `owner` keeps: nothing is copied, and it cannot be written to.
template <class Value>
py::array view(const Value* values, std::vector<py::ssize_t> shape, py::handle owner) {
  py::array array(py::dtype::of<Value>(), std::move(shape), values, owner);
  array.attr("flags").attr("writeable") = false;
  return array;
}

/// Pixels [top, bottom) x [left, right) of an image, a byte each. errors  ValueError: not within the image
py::array boolean_pixels(const RunsView& runs, std::uint32_t top, std::uint32_t bottom, std::uint32_t left,
                         std::uint32_t right);

/// Adds Part and Mesh, and Image and what reads it from a file.
void define_part(py::module_& module);
void define_image(py::module_& module);

/// An image, and the resolution and the tags that its files get.
struct Image {
  Runs runs;
  double dpi_x = 0, dpi_y = 0;
  formats::LayerTags tags = {};
};

}  // namespace lamina::python
