// placeholder until the catalogue lands
#pragma once
