"use strict";
explorer.start();
