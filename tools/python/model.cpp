// SPDX-License-Identifier: Apache-2.0
#include "tools/python/model.h"

#include <dlfcn.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "config/model_file.h"
#include "config/model_names.h"
#include "config/shipped_files.h"
#include "physics/model_consistency.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "physics/spelling.h"
#include "protocol/sha256.h"
#include "tools/files/outputs.h"
#include "tools/files/read_file.h"
#include "tools/files/write_file.h"
#include "tools/python/bindings.h"

namespace stickslip::python {

report::Provenance::File ModelHolder::provenance() const {
  const std::string name = std::filesystem::path(source).filename().string();
  return {name, sha256.empty() ? protocol::sha256_of(config::model_text(model)) : sha256};
}

namespace {

namespace fs = std::filesystem;

// share/stickslip in a folder above this module, in an installation and in a build folder alike.
fs::path shipped_folder() {
  Dl_info here{};
  if (dladdr(reinterpret_cast<const void*>(&shipped_folder), &here) == 0) return {};
  std::error_code error;
  for (fs::path folder = fs::absolute(here.dli_fname, error).parent_path();
       folder != folder.parent_path(); folder = folder.parent_path()) {
    fs::path shipped = folder / "share/stickslip";
    if (fs::is_directory(shipped, error)) return shipped;
  }
  return {};
}

ModelHolder read(const fs::path& name) {
  const fs::path file = config::file_meant(name.string(), "models", shipped_folder());
  return {config::load_model(file), file.string(), protocol::sha256_of(files::content_of(file))};
}

void write(const ModelHolder& self, const fs::path& path, bool force) {
  const std::vector<std::string> inputs =
      self.sha256.empty() ? std::vector<std::string>{} : std::vector{self.source};
  const files::Outputs outputs("stickslip.Model.write", inputs, force);
  outputs.write(path.string(), [&](const fs::path& place) {
    files::write_file(place.string(), config::model_text(self.model));
  });
}

std::vector<std::string> paths_of(const ModelHolder& self) {
  physics::Model model = self.model;
  std::vector<std::string> out;
  for (const auto& each : physics::parameters_of(model)) out.push_back(each.path);
  return out;
}

// Leads into `model`. Throws KeyError with the path that was meant.
physics::Parameter& parameter_of(physics::Model& model, const std::string& path) {
  std::vector<std::string> paths;
  for (const auto& each : physics::parameters_of(model)) {
    if (each.path == path) return *each.parameter;
    paths.push_back(each.path);
  }
  const std::string meant = physics::nearest(path, paths);
  throw py::key_error(
      "the model has no " + path +
      (meant.empty() ? "; list(model) names its parameters" : ": did you mean " + meant + "?"));
}

py::object named_tuple(const physics::Parameter& parameter) {
  return py::module_::import("stickslip._stickslip")
      .attr("Parameter")(parameter.value, parameter.sigma);
}

// A number keeps the standard deviation; a pair sets both.
physics::Parameter with_value(const physics::Parameter& before, const py::object& value,
                              const std::string& path) {
  try {
    if (!py::isinstance<py::sequence>(value)) return {py::cast<double>(value), before.sigma};
    const auto pair = py::cast<std::pair<double, double>>(value);
    return {pair.first, pair.second};
  } catch (const py::cast_error&) {
    throw py::type_error(path + " is set to a number, or to a pair (value, sigma), not to " +
                         py::cast<std::string>(py::repr(value)));
  }
}

// Checked as a file of the same content, whose lines are not those of the model's own file.
physics::Model checked(const physics::Model& model, const std::string& source) {
  try {
    return config::parse_model(config::model_text(model), source);
  } catch (const InputError& error) {
    std::vector<Problem> problems = error.problems();
    for (Problem& each : problems) each.line = each.column = 0;
    throw InputError(std::move(problems));
  }
}

void set_parameter(ModelHolder& self, const std::string& path, const py::object& value) {
  physics::Model changed = self.model;
  physics::Parameter& parameter = parameter_of(changed, path);
  parameter = with_value(parameter, value, path);
  self.model = checked(changed, self.source);
  self.sha256.clear();
}

std::vector<std::string> physics_of(const ModelHolder& self) {
  std::vector<std::string> out;
  for (const physics::Term& term : self.model.terms) out.push_back(physics::path_of(term));
  return out;
}

constexpr const char* class_doc =
    R"(A model of a rig: the content of a model file (docs/formats.md, section 3).

A mapping of its numbers by their paths in the file, in SI units:

    model["oscillator.mass_kg"]              # Parameter(value=95.0, sigma=5.0)
    model["oscillator.mass_kg"] = 96.2       # keeps sigma
    model["oscillator.mass_kg"] = 96.2, 0.1  # value and standard deviation; sigma 0: exact

What has no number yet is added in the text, Model.parse(model.text.replace(...)): a filter, a [[physics]]
term, another law of friction (`stickslip effects` lists the laws, `stickslip effects lugre` explains one
with its parameters). A change that a file could not have raises InputError and leaves the model as it was.)";

}  // namespace

void bind_model(py::module_& module) {
  using namespace py::literals;
  module.attr("Parameter") =
      py::module_::import("collections")
          .attr("namedtuple")("Parameter", "value sigma", "module"_a = "stickslip");
  py::class_<ModelHolder>(module, "Model", class_doc)
      .def_static(
          "read", &read, "path"_a,
          "Reads a model file, or the shipped one of that name (\"beam-1\"). InputError has "
          "file, line and column of every problem.")
      .def_static(
          "parse",
          [](const std::string& text, const std::string& source) {
            return ModelHolder{config::parse_model(text, source), source, {}};
          },
          "text"_a, py::kw_only(), "source"_a = "model",
          "The model of the text of a model file (TOML). `source` names it in messages.")
      .def("write", &write, "path"_a, py::kw_only(), "force"_a = false,
           "Writes a model file that reads back to the bit. A file that this did not write is "
           "replaced only with force=True, the model's own file never.")
      .def(
          "__getitem__",
          [](ModelHolder& self, const std::string& path) {
            return named_tuple(parameter_of(self.model, path));
          },
          "path"_a)
      .def("__setitem__", &set_parameter, "path"_a, "value"_a)
      .def("__len__", [](const ModelHolder& self) { return paths_of(self).size(); })
      .def("__iter__", [](const ModelHolder& self) { return py::iter(py::cast(paths_of(self))); })
      .def(
          "__eq__",
          [](const ModelHolder& self, const ModelHolder& other) {
            return self.model == other.model;
          },
          py::is_operator())
      .def("__repr__",
           [](const ModelHolder& self) {
             return "<stickslip.Model " + self.source + ": " +
                    physics::counted(paths_of(self).size(), "parameter") + ">";
           })
      .def(
          "copy", [](const ModelHolder& self) { return self; },
          "A copy, which can be changed on its own.")
      .def_property_readonly(
          "text", [](const ModelHolder& self) { return config::model_text(self.model); },
          "The text of its file (TOML).")
      .def_property_readonly(
          "source", [](const ModelHolder& self) { return self.source; }, "Its file, or its name.")
      .def_property_readonly(
          "excitation",
          [](const ModelHolder& self) { return config::name_of(self.model.oscillator.excitation); },
          "\"base\", \"force\" or \"imposed\": the channel that drives it.")
      .def_property_readonly("physics", &physics_of,
                             "Paths of its [[physics]] terms, \"physics.cubic_stiffness\".")
      .def_property_readonly(
          "dimensionless", [](const ModelHolder& self) { return self.model.dimensionless; },
          "True if every unit is 1.")
      .def(py::pickle(
          [](const ModelHolder& self) {
            return py::make_tuple(config::model_text(self.model), self.source, self.sha256);
          },
          [](const py::tuple& state) {
            const auto source = state[1].cast<std::string>();
            return ModelHolder{config::parse_model(state[0].cast<std::string>(), source), source,
                               state[2].cast<std::string>()};
          }));
}

}  // namespace stickslip::python
