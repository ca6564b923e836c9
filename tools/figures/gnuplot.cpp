// SPDX-License-Identifier: Apache-2.0
#include "tools/figures/gnuplot.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <sstream>

#include "physics/failure.h"
#include "physics/problem.h"

extern char** environ;  // NOLINT(readability-redundant-declaration): required by POSIX

namespace stickslip::figures {

namespace {

std::string script_of(const Picture& picture) {
  std::string out = "# Drawn by Stickslip; run gnuplot on this file to redraw it.\n";
  char number[32];
  for (const Table& table : picture.tables) {
    out += "$" + table.name + " << EOD\n";
    for (const auto& row : table.rows) {
      for (std::size_t i = 0; i < row.size(); ++i) {
        if (std::isfinite(row[i])) {
          std::snprintf(number, sizeof number, i == 0 ? "%.6g" : " %.6g", row[i]);
          out += number;
        } else {
          out += i == 0 ? "NaN" : " NaN";
        }
      }
      out += '\n';
    }
    out += "EOD\n";
  }
  const std::string size = std::to_string(picture.width) + "," + std::to_string(picture.height);
  out +=
      "set encoding utf8\nset style line 1 lc rgb '#1f5a99' lw 1\n"
      "set palette defined (0 '#440154', 1 '#3b528b', 2 '#21918c', 3 '#5ec962', 4 '#fde725')\n"
      "set border lw 0.8 lc rgb '#444444'\nset tics textcolor rgb '#222222'\n";
  for (const char* form : {"svg", "png"}) {
    const bool svg = std::strcmp(form, "svg") == 0;
    out += svg ? "set terminal svg size " + size + " font 'sans,13' background rgb 'white'\n"
               : "set terminal pngcairo size " + size + " font 'sans,11' background rgb 'white'\n";
    out +=
        "set output '" + picture.stem + "." + form + "'\n" + picture.commands + "\nunset output\n";
  }
  return out;
}

// Runs gnuplot in the folder; returns its standard error.
std::string run_gnuplot(const std::string& script, const std::filesystem::path& folder,
                        int& status) {
  const std::string log = (folder / (script + ".log")).string();
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, log.c_str(),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0644);
  posix_spawn_file_actions_adddup2(&actions, STDERR_FILENO, STDOUT_FILENO);
  std::string program = "gnuplot";
  std::string file = script;
  char* arguments[] = {program.data(), file.data(), nullptr};
  pid_t child = 0;
  const int error = posix_spawnp(&child, "gnuplot", &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) {
    throw InputError(Problem{"gnuplot", 0, 0,
                             std::string("cannot be started (") + std::strerror(error) +
                                 "): the figures need it; install the package gnuplot-nox"});
  }
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  std::ifstream in(log);
  std::ostringstream output;
  output << in.rdbuf();
  in.close();
  std::filesystem::remove(log);
  return output.str();
}

}  // namespace

void draw(const Picture& picture, const std::filesystem::path& folder) {
  const std::filesystem::path script = std::filesystem::absolute(folder) / (picture.stem + ".gp");
  std::ofstream file(script, std::ios::binary);
  file << script_of(picture);
  file.close();
  if (!file) {
    throw InputError(
        Problem{script.string(), 0, 0, std::string("cannot be written: ") + std::strerror(errno)});
  }
  int status = 0;
  const std::string output = run_gnuplot(script.filename().string(), script.parent_path(), status);
  if (status != 0) {
    throw Failure(script.string() + ": gnuplot rejected it: " + output);
  }
}

}  // namespace stickslip::figures
