// SPDX-License-Identifier: Apache-2.0
// Binding of a key to the member that it is read into. The member's type determines the type of the
// key, how it is read, and how its default is written.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "config/calibration.h"
#include "config/campaign.h"
#include "config/fault_script.h"
#include "config/key.h"
#include "config/key_tables.h"
#include "config/model_names.h"
#include "config/names.h"
#include "config/rig.h"
#include "config/toml_text.h"
#include "config/value.h"
#include "physics/frame.h"
#include "physics/model.h"

namespace stickslip::config {

/// Step of a path to a member: the element of the key's channel in an array.
struct ByChannel {};
inline constexpr ByChannel by_channel{};

/// A key bound to a member of Object.
template <class Object>
struct BoundKey : Key {};

/// Reads the keys that are present in a table into `object`, the one that they are bound to.
void read_keys(std::span<const Key> keys, const Value& table, void* object);

namespace detail {

template <class T>
inline constexpr bool is_optional = false;
template <class T>
inline constexpr bool is_optional<std::optional<T>> = true;

template <class Class, class Member>
Class class_of(Member Class::*);

/// The member at the end of the steps; optional parts on the way come into being.
template <auto Step, auto... Rest, class Object>
auto& resolve(Object& object, std::size_t channel) {
  if constexpr (is_optional<Object>) {
    if (!object) object.emplace();
    return resolve<Step, Rest...>(*object, channel);
  } else if constexpr (std::same_as<std::remove_cv_t<decltype(Step)>, ByChannel>) {
    if constexpr (sizeof...(Rest) == 0) {
      return object[channel];
    } else {
      return resolve<Rest...>(object[channel], channel);
    }
  } else if constexpr (sizeof...(Rest) == 0) {
    return object.*Step;
  } else {
    return resolve<Rest...>(object.*Step, channel);
  }
}

/// True if the steps lead through an optional part.
template <class Object, auto Step, auto... Rest>
consteval bool leads_through_optional() {
  if constexpr (is_optional<Object>) {
    return true;
  } else if constexpr (sizeof...(Rest) == 0) {
    return false;
  } else {
    using Next = std::remove_reference_t<decltype(resolve<Step>(std::declval<Object&>(), 0))>;
    return leads_through_optional<Next, Rest...>();
  }
}

}  // namespace detail

/// How a member is read: its type in the file, read() from a value, and initial(), its default as
/// TOML (empty: no value). The general case is an object with keys of its own.
template <class Object>
struct Reading {
  static constexpr Type type = Type::tables;
  static void read(Object& target, const Value& value) {
    read_keys(keys_of<Object>(), value, &target);
  }
  static std::string initial(const Object&) { return {}; }
};

template <>
struct Reading<double> {
  static constexpr Type type = Type::number;
  static void read(double& target, const Value& value) { target = value.number(); }
  static std::string initial(double value) { return toml_number(value); }
};

template <std::integral Integer>
struct Reading<Integer> {
  static constexpr Type type = Type::integer;
  static void read(Integer& target, const Value& value) {
    target = static_cast<Integer>(value.integer());
  }
  static std::string initial(Integer value) { return std::to_string(value); }
};

template <>
struct Reading<bool> {
  static constexpr Type type = Type::boolean;
  static void read(bool& target, const Value& value) { target = value.boolean(); }
  static std::string initial(bool value) { return value ? "true" : "false"; }
};

template <>
struct Reading<std::string> {
  static constexpr Type type = Type::text;
  static void read(std::string& target, const Value& value) { target = value.text(); }
  static std::string initial(const std::string& value) {
    return value.empty() ? std::string() : toml_string(value);
  }
};

template <>
struct Reading<std::filesystem::path> {
  static constexpr Type type = Type::file;
  static void read(std::filesystem::path& target, const Value& value) { target = value.path(); }
  static std::string initial(const std::filesystem::path&) { return {}; }
};

template <Named Enum>
struct Reading<Enum> {
  static constexpr Type type = Type::choice;
  static void read(Enum& target, const Value& value) {
    target = value_in(names<Enum>, value.text()).value_or(target);
  }
  static std::string initial(Enum value) { return toml_string(name_of(value)); }
};

template <>
struct Reading<physics::Parameter> {
  static constexpr Type type = Type::parameter;
  static void read(physics::Parameter& target, const Value& value) { target = value.parameter(); }
  static std::string initial(const physics::Parameter&) { return {}; }
};

template <class Inner>
struct Reading<std::optional<Inner>> {
  static constexpr Type type = Reading<Inner>::type;
  static void read(std::optional<Inner>& target, const Value& value) {
    Reading<Inner>::read(target.emplace(), value);
  }
  static std::string initial(const std::optional<Inner>&) { return {}; }
};

template <>
struct Reading<ValidRange> {
  static constexpr Type type = Type::range;
  static void read(ValidRange& target, const Value& value);
  static std::string initial(const ValidRange&) { return {}; }
};

template <>
struct Reading<LineCovariance> {
  static constexpr Type type = Type::covariance;
  static void read(LineCovariance& target, const Value& value);
  static std::string initial(const LineCovariance&) { return {}; }
};

/// Crosstalk into a channel, by channel.
template <>
struct Reading<std::array<double, channel_count>> {
  static constexpr Type type = Type::crosstalk;
  static void read(std::array<double, channel_count>& target, const Value& value);
  static std::string initial(const std::array<double, channel_count>&) { return {}; }
};

/// Numbers by name; names within tables are joined by dots.
template <>
struct Reading<std::map<std::string, double>> {
  static constexpr Type type = Type::numbers;
  static void read(std::map<std::string, double>& target, const Value& value);
  static std::string initial(const std::map<std::string, double>&) { return {}; }
};

template <>
struct Reading<ChannelCalibration> {
  static constexpr Type type = Type::calibration;
  static void read(ChannelCalibration& target, const Value& value) {
    read_keys(keys_of<ChannelCalibration>(), value, &target);
  }
  static std::string initial(const ChannelCalibration&) { return {}; }
};

template <>
struct Reading<EnvelopePoint> {
  static void read(EnvelopePoint& target, const Value& value);
};

template <>
struct Reading<Line> {
  static void read(Line& target, const Value& value);
};

template <>
struct Reading<physics::Filter> {
  static void read(physics::Filter& target, const Value& value);
};

template <>
struct Reading<physics::Term> {
  static void read(physics::Term& target, const Value& value);
};

/// Type of a list of these.
template <class Element>
inline constexpr Type list_type = Type::tables;
template <>
inline constexpr Type list_type<std::string> = Type::texts;
template <>
inline constexpr Type list_type<std::int64_t> = Type::integers;
template <>
inline constexpr Type list_type<EnvelopePoint> = Type::envelope;
template <>
inline constexpr Type list_type<Line> = Type::lines;
template <>
inline constexpr Type list_type<physics::Filter> = Type::filters;
template <>
inline constexpr Type list_type<physics::Term> = Type::terms;
template <>
inline constexpr Type list_type<Fault> = Type::faults;

template <class Element>
struct Reading<std::vector<Element>> {
  static constexpr Type type = list_type<Element>;
  static void read(std::vector<Element>& target, const Value& value) {
    target.clear();
    for (const Value& each : value.elements()) Reading<Element>::read(target.emplace_back(), each);
  }
  static std::string initial(const std::vector<Element>&) { return {}; }
};

namespace detail {

/// Choices of a member, empty if it is not an enumeration.
template <class Member>
struct MemberInfo {
  static constexpr std::span<const std::string_view> choices() {
    if constexpr (Named<Member>) return names_in<names<Member>>;
    return {};
  }
  static constexpr auto columns() -> std::span<const Key> (*)() { return nullptr; }
};
template <class Inner>
struct MemberInfo<std::optional<Inner>> : MemberInfo<Inner> {};
template <class Element>
struct MemberInfo<std::vector<Element>> {
  static constexpr std::span<const std::string_view> choices() { return {}; }
  static constexpr auto columns() -> std::span<const Key> (*)() {
    if constexpr (list_type<Element> == Type::tables) return &keys_of<Element>;
    return nullptr;
  }
};

template <auto First, auto...>
struct ObjectAt {
  using type = decltype(class_of(First));
};

template <auto... Steps>
using Object = typename ObjectAt<Steps...>::type;

template <auto... Steps>
using Member =
    std::remove_reference_t<decltype(resolve<Steps...>(std::declval<Object<Steps...>&>(), 0))>;

}  // namespace detail

/// The entry of a key that is read into the member at `Steps`: pointers to members from Object on,
/// and by_channel for the element of the channel in an array.
template <auto... Steps>
consteval BoundKey<detail::Object<Steps...>> bound(Key key) {
  using Object = detail::Object<Steps...>;
  using Member = detail::Member<Steps...>;
  key.type = Reading<Member>::type;
  key.choices = detail::MemberInfo<Member>::choices();
  key.columns = detail::MemberInfo<Member>::columns();
  key.in_optional = detail::leads_through_optional<Object, Steps...>();
  key.initial = [] {
    Object object{};
    return Reading<Member>::initial(detail::resolve<Steps...>(object, 0));
  };
  key.assign = [](void* object, std::size_t channel, const Value& value) {
    Reading<Member>::read(detail::resolve<Steps...>(*static_cast<Object*>(object), channel), value);
  };
  return {key};
}

/// The same for a member whose values have names in a table, without being an enumeration.
template <auto& table, auto... Steps>
consteval BoundKey<detail::Object<Steps...>> bound_by_names(Key key) {
  using Object = detail::Object<Steps...>;
  key.type = Type::choice;
  key.choices = names_in<table>;
  key.initial = [] {
    Object object{};
    return toml_string(name_in(table, detail::resolve<Steps...>(object, 0)));
  };
  key.assign = [](void* object, std::size_t channel, const Value& value) {
    auto& member = detail::resolve<Steps...>(*static_cast<Object*>(object), channel);
    member = value_in(table, value.text()).value_or(member);
  };
  return {key};
}

/// The entry of a key that a function reads: void(Object&, std::size_t channel, const Value&).
template <class Object, auto Read>
consteval BoundKey<Object> read_by(Type type, Key key) {
  key.type = type;
  key.assign = [](void* object, std::size_t channel, const Value& value) {
    Read(*static_cast<Object*>(object), channel, value);
  };
  return {key};
}

/// The same key with a narrower type than its member's.
template <class Object>
consteval BoundKey<Object> of_type(Type type, BoundKey<Object> key) {
  key.type = type;
  return key;
}

/// `schema`, with which files of every kind begin.
template <class Object>
consteval BoundKey<Object> schema_key() {
  return {Key{.path = "schema",
              .unit = "1",
              .sentence = "Version of the format of this file.",
              .need = Need::always,
              .low = 1,
              .high = 1,
              .type = Type::integer}};
}

/// A table of keys of one object, from its parts.
template <class Object>
std::vector<Key> joined(std::initializer_list<std::span<const BoundKey<Object>>> parts) {
  std::vector<Key> keys;
  for (const auto& part : parts) keys.insert(keys.end(), part.begin(), part.end());
  return keys;
}

}  // namespace stickslip::config
