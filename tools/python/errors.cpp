// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <string>
#include <string_view>
#include <utility>

#include "physics/failure.h"
#include "physics/problem.h"
#include "tools/python/bindings.h"

namespace stickslip::python {

namespace {

// The classes live as long as the interpreter, as the module does.
struct Classes {
  py::object input_error;
  py::object failure;
};

Classes& classes() {
  static auto* const made = new Classes;
  return *made;
}

// Options of the command line as they are in Python.
std::string in_python(std::string text) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 2> names = {
      {{"--force", "force=True"}, {"--horizon", "horizon_s"}}};
  for (const auto& [option, argument] : names) {
    if (const std::size_t at = text.find(option); at != std::string::npos) {
      text.replace(at, option.size(), argument);
    }
  }
  return text;
}

void raise(const InputError& error) {
  py::list problems;
  for (const Problem& each : error.problems()) {
    problems.append(py::make_tuple(each.file, each.line, each.column, in_python(each.message)));
  }
  const Problem& first = error.problems().front();
  const py::object raised = classes().input_error(in_python(error.what()));
  raised.attr("file") = first.file;
  raised.attr("line") = first.line;
  raised.attr("column") = first.column;
  raised.attr("problems") = problems;
  PyErr_SetObject(classes().input_error.ptr(), raised.ptr());
}

py::object new_exception(py::module_& module, const char* name, PyObject* base, const char* doc) {
  const std::string full = std::string("stickslip.") + name;
  const auto made = py::reinterpret_steal<py::object>(
      PyErr_NewExceptionWithDoc(full.c_str(), doc, base, nullptr));
  if (!made) throw py::error_already_set();
  module.attr(name) = made;
  return made;
}

}  // namespace

void bind_errors(py::module_& module) {
  classes().input_error = new_exception(
      module, "InputError", PyExc_ValueError,
      "Invalid input, with the message of the program: file, line, value, what was expected.\n\n"
      "file, line, column: of the first problem; lines and columns from 1, 0 where unknown\n"
      "problems: all of them, as tuples (file, line, column, message)");
  classes().failure = new_exception(
      module, "Failure", PyExc_RuntimeError,
      "A foreseen failure that no input causes: a full disk, a network that refuses.");
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const InputError& error) {
      raise(error);
    } catch (const Failure& error) {
      PyErr_SetString(classes().failure.ptr(), error.what());
    }
  });
}

}  // namespace stickslip::python
