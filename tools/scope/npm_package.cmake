# SPDX-License-Identifier: Apache-2.0
# Files of npm packages. An archive is taken from the build folder, STICKSLIP_NPM_ARCHIVES, another build
# of this checkout, or the registry, whichever has the expected checksum first.
set(STICKSLIP_NPM_ARCHIVES ${CMAKE_SOURCE_DIR}/tools/scope CACHE PATH
  "Folder with archives fetched elsewhere: npm pack uplot@1.6.32")
set(STICKSLIP_NPM_REGISTRY "" CACHE STRING
  "A mirror of the npm registry; otherwise that of npm's own configuration, or registry.npmjs.org without npm")
find_program(STICKSLIP_NPM npm)

# Sets SAME to whether FILE exists and has this checksum.
function(stickslip_has_sha512 file sha512 same)
  set(found "")
  if(EXISTS ${file})
    file(SHA512 ${file} found)
  endif()
  string(COMPARE EQUAL "${found}" ${sha512} equal)
  set(${same} ${equal} PARENT_SCOPE)
endfunction()

# Fetches NAME-VERSION.tgz into the current build's npm/ and sets PROBLEM to what prevented it. npm, where it
# is installed, knows the registry, proxy and certificates of this machine.
function(stickslip_fetch_from_npm name version problem)
  set(folder ${CMAKE_BINARY_DIR}/npm)
  set(registry https://registry.npmjs.org)
  set(mirror "")
  if(STICKSLIP_NPM_REGISTRY)
    set(registry ${STICKSLIP_NPM_REGISTRY})
    set(mirror --registry ${registry})
  endif()
  file(MAKE_DIRECTORY ${folder})
  set(found_problem "")
  if(STICKSLIP_NPM)
    execute_process(COMMAND ${STICKSLIP_NPM} pack ${name}@${version} --fetch-retries=0 ${mirror}
      WORKING_DIRECTORY ${folder} TIMEOUT 120 OUTPUT_QUIET ERROR_VARIABLE said RESULT_VARIABLE status)
    if(NOT status EQUAL 0)
      string(REGEX MATCH "code [A-Z0-9_]+" code "${said}")
      set(found_problem "npm pack ${name}@${version} failed (${code})")
    endif()
  else()
    set(url ${registry}/${name}/-/${name}-${version}.tgz)
    file(DOWNLOAD ${url} ${folder}/${name}-${version}.tgz STATUS status
      TLS_VERIFY ON INACTIVITY_TIMEOUT 30 TIMEOUT 120)
    list(GET status 0 code)
    list(GET status 1 text)
    if(NOT code EQUAL 0)
      set(found_problem "${url} could not be fetched (${text})")
    endif()
  endif()
  set(${problem} "${found_problem}" PARENT_SCOPE)
endfunction()

#   stickslip_npm_package(NAME VERSION SHA512)
# sets NAME_FOLDER to the folder with the files of the package, and NAME_PROBLEM to the reason, in one
# line, if they are not available. After one failure no other package is asked for in this run of CMake.
function(stickslip_npm_package name version sha512)
  set(archive ${CMAKE_BINARY_DIR}/npm/${name}-${version}.tgz)
  set(folder ${CMAKE_BINARY_DIR}/npm/${name})
  stickslip_has_sha512(${archive} ${sha512} verified)
  file(GLOB elsewhere ${STICKSLIP_NPM_ARCHIVES}/${name}-${version}.tgz
    ${CMAKE_SOURCE_DIR}/build/*/npm/${name}-${version}.tgz)
  foreach(candidate IN LISTS elsewhere)
    if(NOT verified)
      stickslip_has_sha512(${candidate} ${sha512} verified)
      if(verified)
        file(COPY ${candidate} DESTINATION ${CMAKE_BINARY_DIR}/npm)
      endif()
    endif()
  endforeach()

  get_property(problem GLOBAL PROPERTY stickslip_npm_problem)
  if(NOT verified AND NOT problem)
    stickslip_fetch_from_npm(${name} ${version} problem)
    stickslip_has_sha512(${archive} ${sha512} verified)
    if(NOT verified)
      file(REMOVE ${archive})
      if(NOT problem)
        set(problem "${name}-${version}.tgz was received with another checksum")
      endif()
      set_property(GLOBAL PROPERTY stickslip_npm_problem "${problem}")
    endif()
  endif()

  if(verified)
    set(problem "")
    if(NOT EXISTS ${folder}/package/package.json)
      file(ARCHIVE_EXTRACT INPUT ${archive} DESTINATION ${folder})
    endif()
  endif()
  set(${name}_FOLDER ${folder}/package PARENT_SCOPE)
  set(${name}_PROBLEM "${problem}" PARENT_SCOPE)
endfunction()
